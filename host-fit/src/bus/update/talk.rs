//! Requests and their answers, over a bus that may lose either.

use super::UpdateError;
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Command, Content, Mailbox, Outcome, Request};
use hal_adapters::can::update::{Key, Nonce, TAG_INDEX, UpdateData, UpdateRequest, tag, word_of};
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};

/// From frame to frame, us. The receive store of a controller holds three frames and is emptied in
/// every tick of 2 ms: at one frame in a millisecond none is lost, not even to a tick that is late.
pub const SPACING_US: u64 = 1_000;
/// How long an answer is waited for before the request is repeated, us.
const PATIENCE_US: u64 = 100_000;
/// The same where a node has said that it is at it: longer than an erase of its flash, and than a re-zero
/// at the longest servo period, us.
const STARTED_US: u64 = 6_000_000;
/// How often a request is sent: for 3 s, in which a controller starts.
const ATTEMPTS: u32 = 30;
/// How often a request is sent with a new tag, after one over a number that was no longer the last.
const TAGS: u32 = 8;
/// Longest pause before the second tag, us: two tagged requests take less. It doubles with each tag.
const BACK_OFF_US: u64 = 40_000;
/// How often a node names a word that was lost.
const LOST_MAX: u32 = 1_000;
/// The tokens of transfers have this bit, those of other requests do not.
const TRANSFER_TOKEN: u8 = 0x80;

/// A bus and a clock.
pub trait Link {
    /// Sends a frame; one that finds no place may be lost.
    ///
    /// # Errors
    /// [`UpdateError::Link`] if the bus cannot be used.
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError>;

    /// The next frame of the bus, or `None` at this time.
    ///
    /// # Errors
    /// [`UpdateError::Link`] if the bus cannot be used.
    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError>;

    /// Time since some moment, us.
    fn now_us(&self) -> u64;

    /// Whether the user wants it to end.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// A host that asks one thing after the other.
#[derive(Debug)]
pub struct Talk<L> {
    /// The bus.
    pub link: L,
    mailbox: Mailbox,
    token: u8,
    /// When the next frame may leave, us.
    free_us: u64,
    /// Whether the user may end it now.
    pub(super) may_stop: bool,
    /// Whether another host was heard.
    hears_others: bool,
}

impl<L: Link> Talk<L> {
    /// Before the first request. Programs that run one after the other need different tokens: a node
    /// ignores a request that equals the last one.
    pub fn new(link: L, token: u8) -> Self {
        Self {
            link,
            mailbox: Mailbox::default(),
            token: token & !TRANSFER_TOKEN,
            free_us: 0,
            may_stop: true,
            hears_others: false,
        }
    }

    /// The next token of a transfer.
    pub(super) fn transfer_token(&mut self) -> u8 {
        self.next_token() | TRANSFER_TOKEN
    }

    fn next_token(&mut self) -> u8 {
        self.token = self.token.wrapping_add(1) & !TRANSFER_TOKEN;
        self.token
    }

    /// The answer to a request, which is repeated until it comes.
    ///
    /// # Errors
    /// [`UpdateError::NoAnswer`], [`UpdateError::Unexpected`], [`UpdateError::Interrupted`],
    /// [`UpdateError::Link`].
    pub fn exchange(&mut self, request: Request) -> Result<(Outcome, u32), UpdateError> {
        let token = self.next_token();
        self.exchange_under(token, request)
    }

    /// The same of a request about parameters, under the token of a transfer.
    pub(super) fn exchange_under(
        &mut self,
        mut token: u8,
        request: impl Into<Request>,
    ) -> Result<(Outcome, u32), UpdateError> {
        let request = request.into();
        for _ in 0..ATTEMPTS {
            let command = Command::new(request, token);
            self.send(&Content::Command(command))?;
            let mut until_us = self.link.now_us() + PATIENCE_US;
            while let Some(content) = self.receive(until_us)? {
                match content {
                    Content::Answer(answer)
                        if (answer.number, answer.token) == (command.number, token) =>
                    {
                        match answer.outcome {
                            None => return Err(UpdateError::Unexpected { outcome: None }),
                            Some(Outcome::Started) => {
                                until_us = self.link.now_us() + STARTED_US;
                            }
                            Some(outcome) => return Ok((outcome, answer.detail)),
                        }
                    }
                    // The answer could be that of another host: ask anew.
                    Content::Command(other)
                        if (other.number, other.token) == (command.number, token)
                            && token < TRANSFER_TOKEN
                            && other.request != command.request =>
                    {
                        token = self.next_token();
                        break;
                    }
                    _ => {}
                }
            }
        }
        Err(UpdateError::NoAnswer)
    }

    /// As [`Talk::exchange`], of a request that a node with a key obeys only with a tag. It is
    /// [`Outcome::Busy`] where another host is heard and no tag is right.
    ///
    /// # Errors
    /// As [`Talk::exchange`], and [`UpdateError::NoRandomNumber`].
    pub fn exchange_tagged(
        &mut self,
        key: Option<&Key>,
        request: Request,
    ) -> Result<(Outcome, u32), UpdateError> {
        let token = self.next_token();
        self.exchange_tagged_under(token, key, request)
    }

    /// The same under the token of a transfer.
    pub(super) fn exchange_tagged_under(
        &mut self,
        token: u8,
        key: Option<&Key>,
        request: Request,
    ) -> Result<(Outcome, u32), UpdateError> {
        let Some(key) = key else {
            let answer = self.exchange_words(token, request, &[]);
            return answer.map(|(answer, _)| answer);
        };
        let command = Command::new(request, token);
        for tries in 0..TAGS {
            let words = self.authorise(key, &command, &[], 0);
            match words.and_then(|words| self.exchange_words(token, request, &words)) {
                // The number was no longer the last: the node was reset, or another host used it up.
                Ok(((Outcome::NotAuthorised, _), _)) | Err(UpdateError::Lossy) => {}
                answer => return answer.map(|(answer, _)| answer),
            }
            if self.hears_others {
                self.back_off(BACK_OFF_US << tries)?;
            }
        }
        // Which of the two it is shows once the other host is done.
        match self.hears_others {
            true => Ok((Outcome::Busy, 0)),
            false => Ok((Outcome::NotAuthorised, 0)),
        }
    }

    /// The answer to a request for which these words were sent: those that were lost are sent again.
    /// And how many they were.
    pub(super) fn exchange_words(
        &mut self,
        token: u8,
        request: Request,
        words: &[UpdateData],
    ) -> Result<((Outcome, u32), u32), UpdateError> {
        for lost in 0..LOST_MAX {
            let answer = self.exchange_under(token, request)?;
            let (Outcome::Incomplete, index) = answer else {
                return Ok((answer, lost));
            };
            for word in words.iter().filter(|word| u32::from(word.index) == index) {
                self.send_word(*word)?;
            }
        }
        Err(UpdateError::Lossy)
    }

    /// Sends the tag of a command, over a number that is asked for now; `blob` and `crc` as in [`tag`].
    /// Gives the words.
    ///
    /// # Errors
    /// As [`Talk::exchange`], and [`UpdateError::NoRandomNumber`], [`UpdateError::Lossy`].
    pub fn authorise(
        &mut self,
        key: &Key,
        command: &Command,
        blob: &[u8],
        crc: u32,
    ) -> Result<Vec<UpdateData>, UpdateError> {
        let nonce = self.nonce()?;
        let tag = tag(key, &nonce, command, blob, crc);
        let words = words(command.token, &tag, TAG_INDEX);
        words.iter().try_for_each(|word| self.send_word(*word))?;
        Ok(words)
    }

    /// A number that a tag is to be over.
    fn nonce(&mut self) -> Result<Nonce, UpdateError> {
        let mut nonce = [0; 4];
        for (part, word) in (0..).zip(&mut nonce) {
            let challenge = Request::Update(UpdateRequest::Challenge { part });
            *word = match self.exchange(challenge)? {
                (Outcome::Done, drawn) => drawn,
                // The node was reset, or another computer has used it up.
                (Outcome::NoTransfer, _) => return Err(UpdateError::Lossy),
                (outcome, detail) => return Err(UpdateError::of(outcome, detail, false)),
            };
        }
        Ok(nonce)
    }

    /// Sends a word, to which no answer comes.
    pub(super) fn send_word(&mut self, data: UpdateData) -> Result<(), UpdateError> {
        self.send(&Content::UpdateData(data))
    }

    /// Waits.
    pub(super) fn pause(&mut self, us: u64) -> Result<(), UpdateError> {
        let until_us = self.link.now_us() + us;
        while self.receive(until_us)?.is_some() {}
        Ok(())
    }

    /// Waits up to so long, by chance: two hosts do not ask at the same time again.
    fn back_off(&mut self, us_max: u64) -> Result<(), UpdateError> {
        let hasher = BuildHasherDefault::<DefaultHasher>::default();
        self.pause(hasher.hash_one((self.link.now_us(), self.token)) % us_max)
    }

    fn send(&mut self, content: &Content) -> Result<(), UpdateError> {
        while self.receive(self.free_us)?.is_some() {}
        self.free_us = self.link.now_us() + SPACING_US;
        let coded = self.mailbox.send(content);
        coded.map_or(Ok(()), |coded| self.link.send(BusFrame::from(coded)))
    }

    /// The content of the next frame, if one comes until then.
    fn receive(&mut self, until_us: u64) -> Result<Option<Content>, UpdateError> {
        /// How soon Ctrl-C is noticed.
        const WAIT_US: u64 = 50_000;
        loop {
            if self.may_stop && self.link.is_interrupted() {
                return Err(UpdateError::Interrupted);
            }
            let now_us = self.link.now_us();
            if now_us >= until_us {
                return Ok(None);
            }
            if let Some(frame) = self.link.receive(until_us.min(now_us + WAIT_US))?
                && let Some(Ok(content)) = self.mailbox.take(&frame)
            {
                self.hears_others |= matches!(content, Content::Command(_));
                return Ok(Some(content));
            }
        }
    }
}

/// The words of `bytes`, whose first has this index.
pub(super) fn words(token: u8, bytes: &[u8], first: u8) -> Vec<UpdateData> {
    let words = (0..).map_while(|k| {
        let (index, word) = (first.checked_add(k)?, word_of(bytes, k.into())?);
        Some(UpdateData { token, index, word })
    });
    words.collect()
}

/// Tells a fact of the node.
pub(super) const fn page(page: u8) -> Request {
    Request::Update(UpdateRequest::Tell { page })
}
